' for LMDCM
' Fires two outputs at places of one long move, and ends a slew by time.
OS=1,16,1
OS=2,16,1
PG 1
LB Ga
P=0
O1=0
O2=0
TP=51200,Ka
TE=2
MA 512000
H
PR "over ",P
TT=1500,Kc
TE=8
SL 51200
H
PR "slew over ",P
E
LB Ka
O1=1
TP=256000,Kb
TE=2
RT
LB Kb
O2=1
RT
LB Kc
SL 0
RT
PG
S
