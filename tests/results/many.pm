// Several initial states: a walk on 0..4 that starts at an even place.
dtmc

module walk
    x : [0..4];

    [] x>0 & x<4 -> 1/2 : (x'=x-1) + 1/2 : (x'=x+1);
    [] x=0 | x=4 -> true;
endmodule

init mod(x,2)=0 endinit

label "right" = x=4;
