' for LMDCM
VA Q1 = 0
VA Q2 = 0
VA Q3 = 0
D1 = 100
D2 = 100
AS=0
EE=1
PG 1
LB SU
  ER = 0
  C2 = 0
  O1 = 0
  PR "place 1, then button 1"
LB X1
  BR X1, I1 = 0
  Q1 = C2
LB X2
  BR X2, I1 = 1
  PR "place 2, then button 1"
LB X3
  BR X3, I1 = 0
  Q2 = C2
LB X4
  BR X4, I1 = 1
  Q3 = Q2 - Q1
  PR "distance ", Q3
LB X5
  BR X5, I2 = 0
  MA Q1
  H
  H 250
  MA Q2
  H
  H 250
  BR X5
PG
S
