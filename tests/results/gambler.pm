// A gambler with i coins of n wins or loses one per game, until none or all are left.
// Probability of getting all: (1-r^i)/(1-r^n) with r = (1-p)/p, and i/n in a fair game (Feller, 1968, XIV.2).
dtmc

const int n;
const int i;
const double p;

module gambler
    coins : [0..n] init i;

    [] coins>0 & coins<n -> p : (coins'=coins+1) + 1-p : (coins'=coins-1);
endmodule

label "rich" = coins=n;
label "ruined" = coins=0;

rewards "games"
    coins>0 & coins<n : 1;
endrewards
