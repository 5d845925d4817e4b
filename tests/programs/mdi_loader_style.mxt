' for MDI
' A loader that stops at the first error: outputs off before any point is set up.
OL 0
OT 0
NE=0
S1=4,0,0       ' go
S2=16,1,0      ' clamp
S3=16,1,0      ' coolant
S4=17,0,0      ' moving
OL 0
VA PT=0
VA QY=12
PG 1
LB AA
  OT 15
  H 50
  OL 2
  BR Ab, EE=1      ' counts, where there is an encoder
  MR 25600
  H
  BR Ac
LB Ab
  MR 1024
  H
LB Ac
  IC PT
  PR "part ",PT," stall ",ST," at ",C2
  OL 13
  H 20
  BR AA, PT<QY
  OT 0
  E
PG
S
