' for LMDCM
' Feeds a web to a printed mark: slews, is stopped by the mark's trip, moves on by the set length.

' [VARIABLES]
VA Ln=48000        ' length from the mark to the knife
VA Np=0            ' pieces since power-up
IS=1,0,1           ' mark sensor
IS=2,0,0           ' start
OS=1,16,1          ' knife
OS=2,17,1          ' moving
D1=2
VI=2000
VM=400000
A=900000
D=A

' [PROGRAMS]
PG 1
LB SU
  O1=0
  OE Ke
LB Wa                      ' wait for start
  H 5
  BR Wa,I2=0
  TI=1,Km
  TE=1
  SL 150000
LB Ws
  H 10
  BR Ws,MV=1
  CL Kk
  IC Np
  PR "piece ",Np," at ",P
  BR Wa
E

LB Km                      ' the mark
  MR Ln
  H
  RT

LB Kk                      ' the knife
  O1=1
  H 80
  O1=0
  H 40
  RT

LB Ke
  PR "error ",ER
  ER=0
  RT
PG
S
' [END]
