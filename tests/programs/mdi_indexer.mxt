' for MDI
'*****************************************
'*  INDEX TABLE, REV C                   *
'*  IN1 = GO   IN2 = HOME   OUT3 = IN POS *
'*****************************************
VI=1000
VM=200000
A=1000000
D=1000000
HC=25
RC=75
MS=256
OL=0
OT=0
S1=0,1,0
S2=1,1,0
S3=17,1,0
S4=16,1,0
VA Q1=51200
VA Q2=0
PG 1
LB SU
OT 0
HM 1
H
P=0
LB G1
OL 8
CL G9
BR G1,I1=0
OL 0
MR Q1
H
IC Q2
PR "INDEX ",Q2," AT ",P," ENC ",C2," STALL ",ST
LB G2
BR G2,I1=1
BR G1
LB G9
BR G8,I2=0
HM 1
H
P=0
LB G8
RT
E
PG
S
