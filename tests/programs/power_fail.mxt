' for LMDCM
' Keeps the place over a power failure. The supply holds long enough to save.
VA Lp=0
PG 1
LB SU
  P=Lp
  TM=Kp
  TE=64
LB Gl
  MR 51200
  H
  H 500
  MR -51200
  H
  H 500
  BR Gl
E
LB Kp
  SL 0
  Lp=P
  H
  S
  RT
PG
S
