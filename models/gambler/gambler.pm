// The gambler's ruin.
// W. Feller: An Introduction to Probability Theory and Its Applications, volume 1, third edition, Wiley 1968, XIV.2.
dtmc

const int goal = 20;
const int start = 5;
const double win = 0.5;

module gambler
  money : [0..goal] init start;

  [bet] money>0 & money<goal -> win : (money'=money+1) + 1-win : (money'=money-1);
  [] money=0 | money=goal -> true;
endmodule

rewards "bets"
  [bet] true : 1;
endrewards
