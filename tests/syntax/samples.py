"""A model and a properties file with something of everything."""

from __future__ import annotations

MODEL = """// Something of everything.
ctmc

const N; // an int, to be given
const double rate1 = 1e-3;
const int K = 2*N - 1;
rate lambda = .5;
formula busy = a>0 | !done;

global shared : [0..K] init 1;

module first
  a : [0..N+1] init min(N, 2);
  done : bool init false;
  free : int;

  [] a<N & busy -> rate1 : (a'=a+1) & (done'=true) + lambda*2 : true;
  [go] a=N => done -> (a'=0);
  [stop] true -> true;
endmodule

module second = first [ a=b, done=finished, free=f2, go=go2 ] endmodule
module third = first [ a=c, done=over, free=f3, min=max ] endmodule

label "end" = a=N & (done ? b=0 : c!=0);

rewards "time"
  true : 1;
  [go] a>0 : func(pow, a, 2);
  [] busy : floor(a/2)^2;
endrewards
rewards
  a=1 : 2.5;
endrewards

init
  a=0 <=> !done
endinit

system
  ((first |[go, stop]| second) / {stop} ||| third {go<-go3}) || second
endsystem
"""

PROPERTIES = """const int T;
label "safe" = x>2;
formula f = x+1;

// RESULT: 1/2
"named": P=? [ F<=T x=1 ];
P>=0.5 [ (G F "safe") & !(X x=1) ] // RESULT (T=1): true
R{"time"}max=? [ C<=T*2 ];
Rmin=? [ F (x=1 | "named") ]
R{1}<5 [ I=3 {x=1}{min}{max} ];
R=? [ C {x=1}{max} ];
R=? [ C {"init"} ];
R=? [ C^{rew{"cost"}<=k} {x=1} ];
S=? [ x=1 & y!=2 ] + 1 - 2;
filter(max, P=? [ a U[1,T+1] b ], "init"); filter(+, x)
A [ G E [ F "safe" ] ]
multi(Pmax=? [ F a ], R{"time"}<=3 [ C ])
P=? [ F^{rew{"time"}<=T} x=1 ]
P maxmin =? [ X a W>2 (b R c) ]
"""
