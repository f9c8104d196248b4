// A fair die out of fair coins (Knuth & Yao, 1976): outcomes d = 1..6 from coin tosses along a tree with two loops.
dtmc

const double p = 0.5;

module die
    s : [0..7] init 0;
    d : [0..6] init 0;

    [toss] s=0 -> p : (s'=1) + 1-p : (s'=2);
    [toss] s=1 -> p : (s'=3) + 1-p : (s'=4);
    [toss] s=2 -> p : (s'=5) + 1-p : (s'=6);
    [toss] s=3 -> p : (s'=1) + 1-p : (s'=7) & (d'=1);
    [toss] s=4 -> p : (s'=7) & (d'=2) + 1-p : (s'=7) & (d'=3);
    [toss] s=5 -> p : (s'=7) & (d'=4) + 1-p : (s'=7) & (d'=5);
    [toss] s=6 -> p : (s'=2) + 1-p : (s'=7) & (d'=6);
    [] s=7 -> true;
endmodule

label "done" = s=7;
label "six" = s=7 & d=6;

rewards "tosses"
    [toss] true : 1;
endrewards

rewards "waiting"
    s<7 : 1;
endrewards
