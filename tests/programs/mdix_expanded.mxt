' for MDIX
S1=0,1,0
S9=16,1,1
S10=16,1,1
S13=60,0
S7=33,0
PG 1
LB SU
  TC=Tz
  TE=4
  SL 20000
LB Lo
  H 50
  BR Lo,I1=0
  SL 0
  H
  OH 0
  PR "inputs ",IN
  E
LB Tz
  PR "captured ",PC
  OH 3
  TE=4
  RT
PG
