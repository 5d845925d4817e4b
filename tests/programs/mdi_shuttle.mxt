' for MDI
' [VARIABLES]
VM 400000
VI 1000
A 1000000
D=A
HC=5
RC=60
S1=0,0,0       ' start
S2=2,0,0       ' limit +
S3=3,0,0       ' limit -
S4=16,1,0      ' lamp
NE=1
VA CT=0
VA LS=25600
' [PROGRAMS]
PG 100
LB SU
  CT=0
LB Wa
  BR Wa, I1=0
  CL AB
  BR Wa, CT<100
  PR "hundred"
  O4=0
E
LB Ab
  O4=1
  MR LS
  H
  MR -LS
  H
  H 100
  O4=0
  IC CT
  RT
PG
S
' [END]
