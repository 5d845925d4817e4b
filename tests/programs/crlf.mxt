' for LMDCM
VA Q1=5	' tabs and CRLF
PG 1
LB G1		' start
	MR	Q1	' a move
	H		' wait
	PR	"pos	",P
E
PG
