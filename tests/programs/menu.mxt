' for LMDOE
' Asks a person for a distance and a count, and repeats. IV takes the numbers.

VA Q1=0
VA Q2=0
VA Q3=51200
PG 1
LB SU
PR "---------------------"
PR " turns, then repeats "
PR "---------------------"
LB M1
PR "turns? ";
IF=0
IV Q1
LB M2
BR M2,IF=1
BR M1,Q1=0
LB M3
PR "repeats? ";
IV Q2
LB M4
BR M4,IF=1
BR Mb,Q2<1
BR Mb,Q2>50
CL Go
PR "done at ",P
BR M1
LB Mb
PR "1 to 50"
BR M3

LB Go
R1=0
LB G2
MR Q1*Q3
H
H 250
IC R1
BR G2,R1<Q2
MA 0
H
RT
E
PG
S
