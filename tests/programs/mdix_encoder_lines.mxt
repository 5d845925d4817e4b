' for MDIX
' [VARIABLES]
OL 0
OH 0
S13 60,0,0     ' capture
S9=16,1,0
El=4096        ' 4096 lines x 4 = 16384 counts
EE=1
Vm=120000
VI=100
A=200000
D=200000
VA Pt
' [PROGRAMS]
PG 1
LB Su
  P=0
  TC=Kp
LB M1
  TE=4
  MR 16384
  H
  OL 13
  OT 0
  BR M1, P<163840
  PR "ten turns ",C2
  E
LB Kp
  Pt=PC
  O9=1
  PR "mark ",Pt
  O9=0
  RT
PG
S
' [END]
