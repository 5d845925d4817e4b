' for LMDCE
' hMT on: reports lag and a locked rotor, frees it, tries again three times.
VA Qt=0
AS=2
CB=1
LG=51200
LD=51200
LT=1500
VM=500000
A=300000
D=300000
PG 1
LB SU
  H 3000           ' calibration
  Qt=0
  TA=28,Kt
  TE=32
LB G1
  MA 204800
  H
  BR Xk,LR=1
  MA 0
  H
  BR Xk,LR=1
  Qt=0
  BR G1
LB Xk
  PR "locked at ",P," lead/lag ",LL
  IC Qt
  BR Xa,Qt>3
  CF
  H 500
  BR G1
LB Xa
  PR "given up after ",Qt
  E
LB Kt
  PR "hMT status ",AF
  TE=32
  RT
PG
S
