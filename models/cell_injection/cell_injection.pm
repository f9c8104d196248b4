// A fully automated out-of-plane cell injection: a motorised stage drives a needle towards a cell, in X and Y under the
// microscope, in a closed loop of reference, force, torque, motion and noise.
// After: Formal Verification of a Fully Automated Out-of-Plane Cell Injection System (analysed there with PRISM), which
// builds on H. Huang, D. Sun, J. K. Mills, W. J. Li, S. H. Cheng: Visual-based impedance control of out-of-plane cell
// injection systems. IEEE Transactions on Automation Science and Engineering 6(3), 2009.
//
// [P] printed in the paper   [D] follows from what is printed   [C] chosen here, because the paper leaves it open
// docs/cell_injection.md discusses every [C]. Positions are in micrometres, angles in degrees.
dtmc

// ------------------------------------------------------------------------------------------------ what is varied
const int CellBoundaryX;         // [P] where the cell begins: 174, 175, 176
const int CellBoundaryY;         // [P] the same
const double NoisePercentage;    // [P] 0.01: standard deviation of the noise as a share of the position
const int StepSizeXY;            // [P] 18: what the reference advances in each loop
const int InitialPositionXY;     // [P] 100: where the needle starts, in both axes
const int MaxDistance;           // [P] 250: the end of the stage, in both axes
const int Damping;               // 1: the sign of the damping that the paper found to be right;
                                 // 0: the other sign; -1: the other sign, and motion is not clamped to the stage

// ------------------------------------------------------------------------------------------------ the mechanics
// [D] The printed equation of motion of an axis, with x1 and x2 the samples before x, is (to all printed digits)
//        M*(x - 2*x1 + x2) + c*(x - x1) + a = Tau/J - fe
// solved for x, with the numbers below.
const double Mx = 2.12;                                    // inertia
const double My = 1.086;
const double cx = Damping=1 ? -4.533 : 4.533;              // damping and viscous friction, the linear part of N
const double cy = Damping=1 ? -2.35 : 2.35;
// [P] The constant part of N*velocity, 43.748 and 23.168, carries the needle forward by 18.13 and 18.33 in each loop.
// [C] It belongs to the step of 18: other steps scale it.
const double ax = 43.748*StepSizeXY/18;
const double ay = 23.168*StepSizeXY/18;
const double J = 30/0.000009;                              // [P] magnification / distance between camera pixels

// [P] The torque: an inverse of the mechanics that reads the last three reference samples and the last two positions.
const double tx0 = 104.1412293;   const double ty0 = 53.59362672;
const double tx1 = 50.12831775;   const double ty1 = 23.17593265;
const double tx2 = 2.12;          const double ty2 = 1.086;
const double px0 = 108.5542293;   const double py0 = 54.85762672;   // (the other numbers would imply 106.554 for X)
const double px1 = 50.42131775;   const double py1 = 23.35393265;
const double fx  = 6.424236;      const double fy  = 4.4098116;
const double gx  = 43.748;        const double gy  = 23.168;
const double fd  = 3333333.3;                                       // weight of the desired force: J again
const int TauMax = 500000000;     // [C] bound of a torque either way; never reached

// ------------------------------------------------------------------------------------------------ the cell
const int CellPunctured   = 95;   // [C] depth at which the membrane gives way: from there on it is injection
const int LinearDepth     = 40;   // [C] depth up to which the force grows linearly
const int Force_max       = 800;  // [C] bound of the force; never reached
const int Force_threshold = 300;  // [C] a larger force ruptures the cell
const int LeastDesired    = 1;    // [C] least component of the desired force. With 0, ceil(18.13) would make each loop
                                  //     advance by 19; with 1 it is 18 in both axes, as StepSizeXY says
const double along  = 1.2247;     // [C] 1/cos(35.26): a distance seen in the image, measured along the needle
const double across = 0.4082;     // [C] sin(35.26)*cos(45): the share of a force that falls to each axis

// [C] The Gaussian noise has three outcomes one standard deviation apart, with the mass of the standard normal
//     distribution on each interval: -s, 0, +s.
const double Middle = 0.3829;
const double Tail   = (1-Middle)/2;

// ------------------------------------------------------------------------------------------------ the reference
// [C] Sample k of a straight line, the same in both axes. Before the first loop it is one step behind the start, so that
//     in each loop it is compared with the position of the same loop. All that depends on k alone is a formula, no variable.
const int Last = ceil((MaxDistance-InitialPositionXY)/StepSizeXY)+3;   // from here on nothing changes any more
formula Xd_cur  = min(InitialPositionXY+StepSizeXY*(k-1),MaxDistance);
formula Xd_old1 = min(InitialPositionXY+StepSizeXY*(max(k-1,0)-1),MaxDistance);
formula Xd_old2 = min(InitialPositionXY+StepSizeXY*(max(k-2,0)-1),MaxDistance);
formula Yd_cur  = Xd_cur;
formula reaches = Xd_cur>CellBoundaryX & Yd_cur>CellBoundaryY;
formula Sd_dist = ceil(along*pow(pow(max(Xd_cur-CellBoundaryX,0),2)+pow(max(Yd_cur-CellBoundaryY,0),2),0.5));
// The desired force is what the force law gives where the reference is.
formula ForceD  = !reaches | Sd_dist>CellPunctured ? 0 :
                  (Sd_dist<=LinearDepth ? min(max(ceil(8.5714*Sd_dist),0),Force_max)
                                        : min(max(ceil(0.02274*pow(Sd_dist,2)-0.09252*Sd_dist+95.31),0),Force_max));
formula feD     = max(LeastDesired,ceil(across*ForceD));

// ------------------------------------------------------------------------------------------------ what the loop computes
// How deep the tip is in the cell: Euclidean, and an integer because the paper compares it with "=". [C]
formula S_dist   = ceil(along*pow(pow(max(X_n-CellBoundaryX,0),2)+pow(max(Y_n-CellBoundaryY,0),2),0.5));
formula touching = X_n>CellBoundaryX & Y_n>CellBoundaryY;
formula fe       = ceil(across*Force);     // of either axis: feX = feY
formula Tau_x    = min(max(ceil(tx0*Xd_cur-tx1*Xd_old1+tx2*Xd_old2-px0*X_n+px1*X_old-fx*fe+gx+fd*feD),-TauMax),TauMax);
// [C] History: the sample that is two loops old is replaced together with the one that is one loop old, so both are the
//     last position when the needle moves (and the inertia has no say). Only so does a loop advance by StepSizeXY.
formula X_1      = X_n;
formula X_2      = X_n;
formula X_next   = ceil(((2*Mx+cx)*X_1-Mx*X_2+Tau_x/J-fe-ax)/(Mx+cx));

// The phases of the loop: 0 reference, 1 force, 2 motion, 3 noise of X, 4 noise of Y; 5: injected, the loop has ended.
// (The paper's `count`; there decomposition, torques and motions are phases of their own. They are formulas here, because
// a variable that is read once, right after it is written, only multiplies the states.)
module loop
  count : [0..5] init 0;

  [reference] count=0 -> (count'=1);
  [force]     count=1 & !(touching & S_dist>CellPunctured) -> (count'=2);
  [punctured] count=1 & touching & S_dist>CellPunctured -> (count'=5);
  [motion]    count=2 -> (count'=3);
  [noise_x]   count=3 -> (count'=4);
  [noise_y]   count=4 -> (count'=0);
  []          count=5 -> true;
endmodule

module desired
  k : [0..Last] init 0;    // sample of the reference

  [reference] true -> (k'=min(k+1,Last));
endmodule

// The force on the cell, by the depth of the tip. [P]
module controller
  Force : [0..Force_max] init 0;

  [force] !touching -> (Force'=0);
  [force] touching & S_dist<=LinearDepth -> (Force'=min(max(ceil(8.5714*S_dist),0),Force_max));
  [force] touching & S_dist>LinearDepth -> (Force'=min(max(ceil(0.02274*pow(S_dist,2)-0.09252*S_dist+95.31),0),Force_max));
  [punctured] true -> (Force'=0);
endmodule

// One axis: where the mechanics bring the needle, and where it is seen to be after the noise. [P]
module axis_x
  X_cur : [InitialPositionXY..MaxDistance] init InitialPositionXY;
  X_n   : [InitialPositionXY..MaxDistance] init InitialPositionXY;
  X_old : [InitialPositionXY..MaxDistance] init InitialPositionXY;   // X_n one loop ago; only the torque reads it

  [motion]  true -> (X_cur'=Damping<0 ? X_next : min(max(X_next,InitialPositionXY),MaxDistance)) & (X_old'=X_n);
  [noise_x] true -> Tail   : (X_n'=min(max(X_cur-ceil(NoisePercentage*X_cur),InitialPositionXY),MaxDistance))
                  + Middle : (X_n'=X_cur)
                  + Tail   : (X_n'=min(max(X_cur+ceil(NoisePercentage*X_cur),InitialPositionXY),MaxDistance));
endmodule

// The other axis is the same with other numbers.
module axis_y = axis_x [ X_cur=Y_cur, X_n=Y_n, X_old=Y_old, noise_x=noise_y, Mx=My, cx=cy, ax=ay,
                         tx0=ty0, tx1=ty1, tx2=ty2, px0=py0, px1=py1, fx=fy, gx=gy ] endmodule

// ------------------------------------------------------------------------------------------------ labels [P]
label "pre_piercing" = X_n<=CellBoundaryX | Y_n<=CellBoundaryY;
label "piercing" = (X_n>CellBoundaryX | Y_n>CellBoundaryY) & S_dist<=CellPunctured;
label "injection" = (X_n>CellBoundaryX | Y_n>CellBoundaryY) & S_dist>CellPunctured;
label "cell_rupture" = Force>Force_threshold;
label "poor_injection" = Force<ForceD & (X_n>CellBoundaryX | Y_n>CellBoundaryY) & S_dist=CellPunctured;
