' An indexing table: twelve stations of a turn, a dwell at each, and a word when the round is done.
' Run it with EX Ga.

' [VARIABLES]
VI=1000
VM=300000
A=500000
D=A

' [PROGRAMS]
PG 1
LB Ga
  P=0
  R1=0
LB G1
  MR 51200
  H
  H 500
  IC R1
  BR G1,R1<12
  PR "Round done at ",P
E
PG
S
' [END]
