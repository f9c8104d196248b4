// A host joins a network of the IPv4 Zeroconf protocol: it picks an address, which another host
// has with probability q, and sends N probes. A probe of a taken address has no answer with
// probability p; after N of them the host uses the address, wrongly. An answer makes it start anew.
// Source: Bohnenkamp, van der Stok, Hermanns & Vaandrager (DSN 2003), 'Cost-optimization of the
// IPv4 Zeroconf protocol'; as a parametric chain in Hahn, Hermanns & Zhang (STTT 2011).
dtmc

const int N = 3;
const double p;
const double q;

module host
  s : [0..N+2];  // probes without an answer are s-1

  [] s=0 -> q : (s'=1) + 1-q : (s'=N+2);
  [] s>0 & s<=N -> p : (s'=s+1) + 1-p : (s'=0);
  [] s>N -> true;
endmodule

label "wrong" = s=N+1;
label "right" = s=N+2;

rewards "probes"
  s>0 & s<=N : 1;
endrewards
