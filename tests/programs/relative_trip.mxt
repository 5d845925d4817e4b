' for LMDOM
' A strobe every 5,000 steps while the axis turns, 40 times.
VA Ct
OS=1,16,1
PG 1
LB Ga
  Ct=0
  TR=5000,Kf,40
  TE=16
  MR 250000
  H
  PR "strobes ",Ct
E
LB Kf
  O1=1
  IC Ct
  O1=0
  RT
PG
