// The bounded retransmission protocol: a file of N chunks over channels that lose messages.
// L. Helmink, M. P. A. Sellink, F. W. Vaandrager: Proof-checking a data link protocol. TYPES 1993, LNCS 806, 1994.
// P. D'Argenio, B. Jeannet, H. Jensen, K. Larsen: Reachability analysis of probabilistic systems by successive
// refinements. PAPM/PROBMIV 2001, LNCS 2165.
dtmc

const int N;                   // chunks of the file
const int MAX;                 // retransmissions of a chunk before the sender gives up
const double loseData = 0.02;  // probability that the data channel loses a frame
const double loseAck  = 0.01;  // probability that the other channel loses an acknowledgement

module sender
  // 0 has a frame to send, 1 waits, 2 has sent the whole file, 3 has given up
  s     : [0..3] init 0;
  chunk : [1..N] init 1;
  tries : [0..MAX] init 0;
  bit   : bool init false;

  [send] s=0 -> (s'=1);
  [ack] s=1 & chunk<N -> (s'=0) & (chunk'=chunk+1) & (tries'=0) & (bit'=!bit);
  [ack] s=1 & chunk=N -> (s'=2);
  [lostData] s=1 & tries<MAX -> (s'=0) & (tries'=tries+1);
  [lostData] s=1 & tries=MAX -> (s'=3);
  [lostAck] s=1 & tries<MAX -> (s'=0) & (tries'=tries+1);
  [lostAck] s=1 & tries=MAX -> (s'=3);
  [] s>=2 -> true;
endmodule

module dataChannel
  // 0 empty, 1 holds a frame, 2 has lost it (the sender's timer will run out)
  k : [0..2] init 0;

  [send] k=0 -> 1-loseData : (k'=1) + loseData : (k'=2);
  [deliver] k=1 -> (k'=0);
  [lostData] k=2 -> (k'=0);
endmodule

module receiver
  r        : [0..1] init 0;        // 1: must acknowledge
  received : [0..N] init 0;
  expected : bool init false;      // the alternating bit of the next new chunk

  [deliver] r=0 & bit=expected & received<N -> (r'=1) & (received'=received+1) & (expected'=!expected);
  [deliver] r=0 & bit!=expected -> (r'=1);
  [reply] r=1 -> (r'=0);
endmodule

module ackChannel
  l : [0..2] init 0;

  [reply] l=0 -> 1-loseAck : (l'=1) + loseAck : (l'=2);
  [ack] l=1 -> (l'=0);
  [lostAck] l=2 -> (l'=0);
endmodule

rewards "frames"
  [send] true : 1;
endrewards

label "gave_up" = s=3;
label "whole_file" = received=N;
