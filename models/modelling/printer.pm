// A printer, looked at once a minute.
dtmc

const double jam = 0.05;  // the probability that a minute of printing ends with a jam

module printer
  state : [0..2] init 0;  // 0: idle, 1: printing, 2: jammed

  [] state=0 -> 0.2 : (state'=1) + 0.8 : (state'=0);
  [] state=1 -> jam : (state'=2) + 0.5 : (state'=0) + 0.5-jam : (state'=1);
  [] state=2 -> 0.1 : (state'=0) + 0.9 : (state'=2);
endmodule

label "jammed" = state=2;
