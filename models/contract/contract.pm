// Fair exchange of signatures by oblivious transfer, with four pairs of secrets a side.
// S. Even, O. Goldreich, A. Lempel: A randomized protocol for signing contracts. Communications of the ACM 28(6), 1985.
// G. Norman and V. Shmatikov: Analysis of probabilistic contract signing. Journal of Computer Security 14(6), 2006.
//
// A party is bound once the other knows both secrets of one of its pairs. First each side learns one secret of every
// pair, and the owner can't tell which. Then the secrets go over in turns, Alice first: one of hers, one of Bob's; first
// the left secrets of all pairs, then the right ones. (The bits of a secret before its last change nothing here.)
// Bob stops as soon as he knows a pair.
dtmc

const int pairs = 4;

module transfer
  // 0 oblivious transfers, 1 Alice's turn, 2 Bob's turn
  turn : [0..2] init 0;
  step : [1..2*pairs] init 1;

  [learn] turn=0 & step<pairs -> (step'=step+1);
  [learn] turn=0 & step=pairs -> (turn'=1) & (step'=1);
  [alice] turn=1 & !bobHasPair -> (turn'=2);
  [bob] turn=2 & step<2*pairs -> (turn'=1) & (step'=step+1);
  [bob] turn=2 & step=2*pairs -> (turn'=1);
  [] turn=1 & bobHasPair -> true;
endmodule

// Which secret of pair i the other side got: the left one (true) or the right one.
module bobLearns
  l1 : bool init false;  l2 : bool init false;  l3 : bool init false;  l4 : bool init false;
  bobHasPair : bool init false;

  [learn] step=1 -> 0.5 : (l1'=true) + 0.5 : true;
  [learn] step=2 -> 0.5 : (l2'=true) + 0.5 : true;
  [learn] step=3 -> 0.5 : (l3'=true) + 0.5 : true;
  [learn] step=4 -> 0.5 : (l4'=true) + 0.5 : true;
  [alice] true -> (bobHasPair'=bobHasPair | bobNews);
endmodule

module aliceLearns
  r1 : bool init false;  r2 : bool init false;  r3 : bool init false;  r4 : bool init false;
  aliceHasPair : bool init false;

  [learn] step=1 -> 0.5 : (r1'=true) + 0.5 : true;
  [learn] step=2 -> 0.5 : (r2'=true) + 0.5 : true;
  [learn] step=3 -> 0.5 : (r3'=true) + 0.5 : true;
  [learn] step=4 -> 0.5 : (r4'=true) + 0.5 : true;
  [bob] true -> (aliceHasPair'=aliceHasPair | aliceNews);
endmodule

// The secret that goes over is news where the other half of its pair was learnt before.
formula bobNews = (step=1&!l1) | (step=2&!l2) | (step=3&!l3) | (step=4&!l4) | (step=5&l1) | (step=6&l2) | (step=7&l3) | (step=8&l4);
formula aliceNews = (step=1&!r1) | (step=2&!r2) | (step=3&!r3) | (step=4&!r4) | (step=5&r1) | (step=6&r2) | (step=7&r3) | (step=8&r4);

// Alice is bound and Bob is not.
label "unfair_to_alice" = bobHasPair & !aliceHasPair;
label "unfair_to_bob" = aliceHasPair & !bobHasPair;
