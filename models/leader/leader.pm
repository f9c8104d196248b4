// Election of a leader in a synchronous ring of four anonymous processes.
// A. Itai and M. Rodeh: Symmetry breaking in distributed networks. Information and Computation 88(1), 1990.
//
// In each round every process draws one of four numbers and the numbers travel once around the ring. The process with
// the greatest number that nobody else has drawn becomes the leader; if there is none, a new round begins.
dtmc

module ring
  // 0 draw, 1 to 3 the hops of the numbers, 4 decided
  hop : [0..4] init 0;

  [draw] hop=0 -> (hop'=1);
  [pass] hop>0 & hop<3 -> (hop'=hop+1);
  [decide] hop=3 & someUnique -> (hop'=4);
  [again] hop=3 & !someUnique -> (hop'=0);
  [done] hop=4 -> true;
endmodule

module process1
  n1 : [0..3] init 0;   // the number drawn

  [draw] true -> 0.25 : (n1'=0) + 0.25 : (n1'=1) + 0.25 : (n1'=2) + 0.25 : (n1'=3);
  [again] true -> (n1'=0);
endmodule

module process2 = process1 [ n1=n2 ] endmodule
module process3 = process1 [ n1=n3 ] endmodule
module process4 = process1 [ n1=n4 ] endmodule

formula unique1 = n1!=n2 & n1!=n3 & n1!=n4;
formula unique2 = n2!=n1 & n2!=n3 & n2!=n4;
formula unique3 = n3!=n1 & n3!=n2 & n3!=n4;
formula unique4 = n4!=n1 & n4!=n2 & n4!=n3;
formula someUnique = unique1 | unique2 | unique3 | unique4;

rewards "rounds"
  [draw] true : 1;
endrewards

label "elected" = hop=4;
