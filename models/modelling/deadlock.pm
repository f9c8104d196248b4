// A counter that stops at 3, where no command is enabled.
dtmc

module counter
  n : [0..3] init 0;

  [] n<3 -> 0.9 : (n'=n+1) + 0.1 : true;
endmodule
