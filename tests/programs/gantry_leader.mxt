' for LMDCM
' Leads another drive of the party line by what it prints.
DN="A"
EM=2
PG 1
LB SU
  H 2000
LB G1
  PR "BMA 51200"
  MA 51200
  H
  H 400
  PR "BMA 0"
  MA 0
  H
  H 400
  BR G1,I1=0
  PR "Bex 100"
  E
PG
S
