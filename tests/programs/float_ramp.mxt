' for LMM
' A sine between two places, with the floating point registers.
RA=0
PG 1
LB Ga
  F1=0.0
  F2=10.5
  R1=0
LB Gb
  F3=SI F1
  F4=F3*25600
  R2=F4
  MA R2
  H
  F1=F1+F2
  IC R1
  BR Gb,R1<36
  F5=SQ F2
  F6=AB F3
  PR "root ",F5," last ",F6
  MA 0
  H
E
PG
