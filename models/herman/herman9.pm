// Herman's self-stabilising ring of 9 processes.
// T. Herman: Probabilistic self-stabilization. Information Processing Letters 35(2), 1990.
//
// Every process holds a bit; in each step all move together: one whose bit equals its left neighbour's tosses a coin,
// another copies the neighbour. A process whose bit equals its left neighbour's has a token; their number never grows
// and stays odd. The ring may start in any state.
dtmc

module bit1
  x1 : [0..1];

  [step] x1=x9  -> 0.5 : (x1'=0) + 0.5 : (x1'=1);
  [step] x1!=x9 -> (x1'=x9);
endmodule

module bit2 = bit1 [ x1=x2, x9=x1 ] endmodule
module bit3 = bit1 [ x1=x3, x9=x2 ] endmodule
module bit4 = bit1 [ x1=x4, x9=x3 ] endmodule
module bit5 = bit1 [ x1=x5, x9=x4 ] endmodule
module bit6 = bit1 [ x1=x6, x9=x5 ] endmodule
module bit7 = bit1 [ x1=x7, x9=x6 ] endmodule
module bit8 = bit1 [ x1=x8, x9=x7 ] endmodule
module bit9 = bit1 [ x1=x9, x9=x8 ] endmodule

formula tokens = (x1=x9 ? 1 : 0)+(x2=x1 ? 1 : 0)+(x3=x2 ? 1 : 0)+(x4=x3 ? 1 : 0)+(x5=x4 ? 1 : 0)+(x6=x5 ? 1 : 0)+(x7=x6 ? 1 : 0)+(x8=x7 ? 1 : 0)+(x9=x8 ? 1 : 0);

rewards "steps"
  true : 1;
endrewards

label "stable" = tokens=1;

init
  true
endinit
