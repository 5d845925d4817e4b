' for LMDOM
' Written with addresses instead of labels.
VM 300000
PG 1
PR "main"
CL 200
CL 200,I1=1
BR 1,I2=0
E
PG
PG 200
MR 1000
H
RT
PG
S
