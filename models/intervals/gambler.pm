// The gambler's ruin with a coin that is known up to an interval only.
// W. Feller: An Introduction to Probability Theory and Its Applications, volume 1, third edition, Wiley 1968, XIV.2.
dtmc

const int goal = 20;
const int start = 5;
const double low = 0.45;
const double high = 0.49;

module gambler
  money : [0..goal] init start;

  [bet] money>0 & money<goal -> [low,high] : (money'=money+1) + [1-high,1-low] : (money'=money-1);
  [] money=0 | money=goal -> true;
endmodule

rewards "bets"
  [bet] true : 1;
endrewards

label "ruined" = money=0;
