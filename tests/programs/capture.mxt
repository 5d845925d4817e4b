' for LMDCM
' Latches the place at which input 1 closes, and goes back to it.
IS=1,12,0
PG 1
LB Ga
  TC=Kc
  TE=4
  R4=0
  SL 80000
LB Gw
  H 5
  BR Gw,R4=0
  SL 0
  H
  MA R3
  H
  PR "back at ",P
E
LB Kc
  R3=PC
  R4=1
  RT
PG
