' for LMDOM
`[VARIABLES]
VA Ns=0 `station, 0 to 7
VA Dx = 6400
Ms=256
Vi=1000
Vm=200000
A=600000
D=A
Rc=80
Hc=20

`[PROGRAMS]
PG 100
	LB Ho			`home first
		Vm=60000
		HM 1
		H
		P=0
		Ns=0
		Vm=200000
	LB Nx			`next station
		BR Nx,I2=0
		MR Dx
		H
		IC Ns
		BR Ok,Ns<8
		Ns=0
	LB Ok
		PR "S"Ns
		H 50
	LB Ow			`wait until the button is let go
		BR Ow,I2=1
		BR Nx
	E
PG

PG 400
	LB Zr			`EX Zr from the host: back to the first station
		MA 0
		H
		Ns=0
		PR "zero"
	E
PG
S
`[END]
