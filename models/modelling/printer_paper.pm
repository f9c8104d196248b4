// Exercise 1: the printer runs out of paper, too.
dtmc

const double jam = 0.05;
const double empty = 0.02;  // the probability that a minute of printing takes the last sheet

module printer
  state : [0..3] init 0;  // 0: idle, 1: printing, 2: jammed, 3: without paper

  [] state=0 -> 0.2 : (state'=1) + 0.8 : (state'=0);
  [] state=1 -> jam : (state'=2) + empty : (state'=3) + 0.5 : (state'=0)
              + 0.5-jam-empty : (state'=1);
  [] state=2 -> 0.1 : (state'=0) + 0.9 : (state'=2);
  [] state=3 -> 0.5 : (state'=0) + 0.5 : (state'=3);
endmodule

label "waits" = state>=2;
