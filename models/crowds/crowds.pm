// Anonymous web browsing in a crowd that corrupt members have joined.
// M. K. Reiter and A. D. Rubin: Crowds: anonymity for web transactions. ACM TISSEC 1(1), 1998.
// V. Shmatikov: Probabilistic analysis of an anonymity system. Journal of Computer Security 12, 2004.
//
// In each of TotalRuns protocol runs, honest member 0 sends a request to a random member of the crowd. An honest
// member forwards it to a random member with probability PF, or else delivers it. A corrupt member notes from whom
// the request came, and delivers it. Member i is {0, ..., CrowdSize-1}; up to 20 honest members.
dtmc

const int CrowdSize;              // honest members
const int TotalRuns;              // protocol runs
const double PF = 0.8;            // probability that an honest member forwards
const double corrupt = 0.091;     // probability that a member chosen at random is corrupt

module crowd
  // 0 between runs, 1 sent to a random member, 2 an honest member has it, 3 a corrupt member has it
  phase  : [0..3] init 0;
  runs   : [0..TotalRuns] init TotalRuns;
  // the member who sent it last; forgotten when a run ends
  holder : [0..19] init 0;
  // how often the corrupt members got a request from member i
  observed0  : [0..TotalRuns] init 0;
  observed1  : [0..TotalRuns] init 0;
  observed2  : [0..TotalRuns] init 0;
  observed3  : [0..TotalRuns] init 0;
  observed4  : [0..TotalRuns] init 0;
  observed5  : [0..TotalRuns] init 0;
  observed6  : [0..TotalRuns] init 0;
  observed7  : [0..TotalRuns] init 0;
  observed8  : [0..TotalRuns] init 0;
  observed9  : [0..TotalRuns] init 0;
  observed10 : [0..TotalRuns] init 0;
  observed11 : [0..TotalRuns] init 0;
  observed12 : [0..TotalRuns] init 0;
  observed13 : [0..TotalRuns] init 0;
  observed14 : [0..TotalRuns] init 0;
  observed15 : [0..TotalRuns] init 0;
  observed16 : [0..TotalRuns] init 0;
  observed17 : [0..TotalRuns] init 0;
  observed18 : [0..TotalRuns] init 0;
  observed19 : [0..TotalRuns] init 0;

  [] phase=0 & runs>0 -> (phase'=1) & (runs'=runs-1);
  [] phase=1 -> 1-corrupt : (phase'=2) + corrupt : (phase'=3);
  [] phase=2 -> 1-PF : (phase'=0) & (holder'=0)
           + (CrowdSize>0 ? PF/CrowdSize : 0) : (holder'=0) & (phase'=1)
           + (CrowdSize>1 ? PF/CrowdSize : 0) : (holder'=1) & (phase'=1)
           + (CrowdSize>2 ? PF/CrowdSize : 0) : (holder'=2) & (phase'=1)
           + (CrowdSize>3 ? PF/CrowdSize : 0) : (holder'=3) & (phase'=1)
           + (CrowdSize>4 ? PF/CrowdSize : 0) : (holder'=4) & (phase'=1)
           + (CrowdSize>5 ? PF/CrowdSize : 0) : (holder'=5) & (phase'=1)
           + (CrowdSize>6 ? PF/CrowdSize : 0) : (holder'=6) & (phase'=1)
           + (CrowdSize>7 ? PF/CrowdSize : 0) : (holder'=7) & (phase'=1)
           + (CrowdSize>8 ? PF/CrowdSize : 0) : (holder'=8) & (phase'=1)
           + (CrowdSize>9 ? PF/CrowdSize : 0) : (holder'=9) & (phase'=1)
           + (CrowdSize>10 ? PF/CrowdSize : 0) : (holder'=10) & (phase'=1)
           + (CrowdSize>11 ? PF/CrowdSize : 0) : (holder'=11) & (phase'=1)
           + (CrowdSize>12 ? PF/CrowdSize : 0) : (holder'=12) & (phase'=1)
           + (CrowdSize>13 ? PF/CrowdSize : 0) : (holder'=13) & (phase'=1)
           + (CrowdSize>14 ? PF/CrowdSize : 0) : (holder'=14) & (phase'=1)
           + (CrowdSize>15 ? PF/CrowdSize : 0) : (holder'=15) & (phase'=1)
           + (CrowdSize>16 ? PF/CrowdSize : 0) : (holder'=16) & (phase'=1)
           + (CrowdSize>17 ? PF/CrowdSize : 0) : (holder'=17) & (phase'=1)
           + (CrowdSize>18 ? PF/CrowdSize : 0) : (holder'=18) & (phase'=1)
           + (CrowdSize>19 ? PF/CrowdSize : 0) : (holder'=19) & (phase'=1);
  [] phase=3 & holder=0  & observed0<TotalRuns -> (observed0'=observed0+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=1  & observed1<TotalRuns -> (observed1'=observed1+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=2  & observed2<TotalRuns -> (observed2'=observed2+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=3  & observed3<TotalRuns -> (observed3'=observed3+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=4  & observed4<TotalRuns -> (observed4'=observed4+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=5  & observed5<TotalRuns -> (observed5'=observed5+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=6  & observed6<TotalRuns -> (observed6'=observed6+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=7  & observed7<TotalRuns -> (observed7'=observed7+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=8  & observed8<TotalRuns -> (observed8'=observed8+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=9  & observed9<TotalRuns -> (observed9'=observed9+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=10 & observed10<TotalRuns -> (observed10'=observed10+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=11 & observed11<TotalRuns -> (observed11'=observed11+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=12 & observed12<TotalRuns -> (observed12'=observed12+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=13 & observed13<TotalRuns -> (observed13'=observed13+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=14 & observed14<TotalRuns -> (observed14'=observed14+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=15 & observed15<TotalRuns -> (observed15'=observed15+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=16 & observed16<TotalRuns -> (observed16'=observed16+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=17 & observed17<TotalRuns -> (observed17'=observed17+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=18 & observed18<TotalRuns -> (observed18'=observed18+1) & (phase'=0) & (holder'=0);
  [] phase=3 & holder=19 & observed19<TotalRuns -> (observed19'=observed19+1) & (phase'=0) & (holder'=0);
  [] phase=0 & runs=0 -> true;
endmodule

// The corrupt members see the true sender more than once.
label "exposed" = observed0>1;
// They see some other member more than once.
label "misled" = observed1>1 | observed2>1 | observed3>1 | observed4>1 | observed5>1 | observed6>1 | observed7>1 | observed8>1 | observed9>1 | observed10>1 | observed11>1 | observed12>1 | observed13>1 | observed14>1 | observed15>1 | observed16>1 | observed17>1 | observed18>1 | observed19>1;
