\ for LMDCM
\ The wheel follows a potentiometer; a dead band in the middle.
IS=5,9,0
D5=20
VA Mi=2048
VA Qb=60
VI=200
A=200000
D=200000
PG 1
LB SU
LB Lp
	R1=I5-Mi
	R2=R1
	BR X1,R2>=0
	R2=-R2
LB X1
	BR X3,R2<Qb
	R1=R1*60
	BR X2,R1>0
	BR Ng
LB X2
	SL R1
	H 20
	BR Lp
LB Ng
	SL R1
	H 20
	BR Lp
LB X3
	SL 0
	H 20
	BR Lp
E
PG
