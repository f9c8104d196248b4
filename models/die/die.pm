// A fair die from a fair coin.
// D. E. Knuth and A. C. Yao: The complexity of nonuniform random number generation.
// In: Algorithms and Complexity, Academic Press, 1976.
dtmc

module die
  // the node of the decision tree that the tosses have led to; 7 is a leaf
  s : [0..7] init 0;
  // the face shown, 0 while undecided
  d : [0..6] init 0;

  [] s=0 -> 0.5 : (s'=1) + 0.5 : (s'=2);
  [] s=1 -> 0.5 : (s'=3) + 0.5 : (s'=4);
  [] s=2 -> 0.5 : (s'=5) + 0.5 : (s'=6);
  [] s=3 -> 0.5 : (s'=1) + 0.5 : (s'=7) & (d'=1);
  [] s=4 -> 0.5 : (s'=7) & (d'=2) + 0.5 : (s'=7) & (d'=3);
  [] s=5 -> 0.5 : (s'=7) & (d'=4) + 0.5 : (s'=7) & (d'=5);
  [] s=6 -> 0.5 : (s'=2) + 0.5 : (s'=7) & (d'=6);
  [] s=7 -> true;
endmodule

rewards "tosses"
  s<7 : 1;
endrewards

label "done" = s=7;
