' for LMDCM
' Jog inputs, limit switches; an error leads back between them.
IS=1,2,0
IS=2,3,0
IS=3,7,0
IS=4,8,0
LM=1
JE=1
PG 1
LB SU
  OE E1
LB Id
  H 100
  BR Id
LB E1
  BR Pl,ER=83
  BR Mi,ER=84
  PR "error ",ER
  ER=0
  RT
LB Pl
  ER=0
  PR "plus limit"
  MR -2000
  H
  RT
LB Mi
  ER=0
  PR "minus limit"
  MR 2000
  H
  RT
PG
S
