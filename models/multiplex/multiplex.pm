// A NAND gate made reliable by multiplexing: N unreliable copies of it, then stages that restore the bundle of wires.
// J. von Neumann: Probabilistic logics and the synthesis of reliable organisms from unreliable components. Automata
// Studies, Princeton 1956. G. Norman, D. Parker, M. Kwiatkowska and S. Shukla: Evaluating the reliability of NAND
// multiplexing with PRISM. IEEE Transactions on CAD 24(10), 2005.
//
// Copy by copy: each takes one wire of either input bundle, at random and without replacement, so that only the number of
// excited wires left in each bundle matters. A copy answers wrongly with probability `fault`. The output bundle becomes both
// inputs of the next stage; the executive stage and `K` restorative pairs are 2K+1 stages.
dtmc

const int N;                 // copies, and wires of a bundle
const int K;                 // restorative pairs of stages
const double fault = 0.02;   // probability that a copy answers wrongly
const double excited = 0.9;  // probability that an input wire is excited

module multiplexer
  stage : [1..2*K+1] init 1;
  copy  : [0..N] init 0;           // copies done in this stage
  left_in  : [0..N] init N;        // excited wires among those not taken, of either bundle (stages after the first)
  right_in : [0..N] init N;
  outputs  : [0..N] init 0;        // excited outputs of this stage
  phase : [0..3] init 0;           // 0 take left, 1 take right, 2 answer, 3 all stages done
  left  : bool init false;
  right : bool init false;

  // The first stage's wires are independent.
  [] phase=0 & copy<N & stage=1 -> excited : (left'=true) & (phase'=1) + 1-excited : (left'=false) & (phase'=1);
  [] phase=1 & stage=1 -> excited : (right'=true) & (phase'=2) + 1-excited : (right'=false) & (phase'=2);
  [] phase=0 & copy<N & stage>1 -> left_in/(N-copy) : (left'=true) & (left_in'=max(0,left_in-1)) & (phase'=1)
                                 + 1-left_in/(N-copy) : (left'=false) & (phase'=1);
  [] phase=1 & stage>1 -> right_in/(N-copy) : (right'=true) & (right_in'=max(0,right_in-1)) & (phase'=2)
                        + 1-right_in/(N-copy) : (right'=false) & (phase'=2);
  [] phase=2 & copy<N & outputs<N ->
        1-fault : (outputs'=outputs+(left&right ? 0 : 1)) & (copy'=copy+1) & (left'=false) & (right'=false) & (phase'=0)
      + fault : (outputs'=outputs+(left&right ? 1 : 0)) & (copy'=copy+1) & (left'=false) & (right'=false) & (phase'=0);
  [] phase=0 & copy=N & stage<2*K+1 ->
        (stage'=stage+1) & (copy'=0) & (left_in'=outputs) & (right_in'=outputs) & (outputs'=0);
  [] phase=0 & copy=N & stage=2*K+1 -> (phase'=3) & (left_in'=N) & (right_in'=N);
  [] phase=3 -> true;
endmodule

rewards "copies"
  phase=2 : 1;
endrewards
