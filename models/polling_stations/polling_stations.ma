// Two stations with queues, and a server that takes jobs from either: a Markov automaton.
//
// Jobs arrive at random. Their type is not known, nor which station the server polls next, nor
// whether a job that is served leaves the queue or has to be served again: these are choices, which
// take no time. A job of type j is served at the rate 2^j.
//
// Source: M. Timmer, J.-P. Katoen, J. van de Pol and M. Stoelinga, Efficient modelling and
// generation of Markov automata (CONCUR 2012), after M. Srinivasan, Nondeterministic polling
// systems (1991); rates and choices as in the quantitative verification benchmark set.
ma

const int SIZE = 3;  // of each queue

formula full = n1=SIZE & n2=SIZE;

module station1
  state1 : [0..2];  // waiting, a job has arrived, a job is being delivered
  n1 : [0..SIZE];   // jobs in the queue, and their types
  first1 : [0..3];
  second1 : [0..3];
  third1 : [0..3];

  <> state1=0 & n1<SIZE -> 0.3 : (state1'=1);
  [one1] state1=1 -> (state1'=0) & (n1'=n1+1) & (first1'=n1=0 ? 1 : first1)
                     & (second1'=n1=1 ? 1 : second1) & (third1'=n1=2 ? 1 : third1);
  [two1] state1=1 -> (state1'=0) & (n1'=n1+1) & (first1'=n1=0 ? 2 : first1)
                     & (second1'=n1=1 ? 2 : second1) & (third1'=n1=2 ? 2 : third1);
  [three1] state1=1 -> (state1'=0) & (n1'=n1+1) & (first1'=n1=0 ? 3 : first1)
                       & (second1'=n1=1 ? 3 : second1) & (third1'=n1=2 ? 3 : third1);
  [deliver1] state1=0 & n1>0 -> (state1'=2);
  [leave1] state1=2 -> (state1'=0) & (n1'=n1-1)
                       & (first1'=second1) & (second1'=third1) & (third1'=0);
  [again1] state1=2 -> (state1'=0);
endmodule

module station2
  state2 : [0..2];
  n2 : [0..SIZE];
  first2 : [0..3];
  second2 : [0..3];
  third2 : [0..3];

  <> state2=0 & n2<SIZE -> 0.5 : (state2'=1);
  [one2] state2=1 -> (state2'=0) & (n2'=n2+1) & (first2'=n2=0 ? 1 : first2)
                     & (second2'=n2=1 ? 1 : second2) & (third2'=n2=2 ? 1 : third2);
  [two2] state2=1 -> (state2'=0) & (n2'=n2+1) & (first2'=n2=0 ? 2 : first2)
                     & (second2'=n2=1 ? 2 : second2) & (third2'=n2=2 ? 2 : third2);
  [three2] state2=1 -> (state2'=0) & (n2'=n2+1) & (first2'=n2=0 ? 3 : first2)
                       & (second2'=n2=1 ? 3 : second2) & (third2'=n2=2 ? 3 : third2);
  [deliver2] state2=0 & n2>0 -> (state2'=2);
  [leave2] state2=2 -> (state2'=0) & (n2'=n2-1)
                       & (first2'=second2) & (second2'=third2) & (third2'=0);
  [again2] state2=2 -> (state2'=0);
endmodule

module server
  job : [0..3];  // its type, 0 if the server is idle

  [deliver1] job=0 -> (job'=first1);
  [deliver2] job=0 -> (job'=first2);
  <> job>0 -> pow(2, job) : (job'=0);
endmodule

label "full" = full;

rewards "waiting"  // jobs in the queues, per unit of time
  true : n1 + n2;
endrewards

rewards "served"
  [deliver1] true : 1;
  [deliver2] true : 1;
endrewards
