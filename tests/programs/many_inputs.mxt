' for LMDOM
' Chooses one of four recipes by three inputs.
VA Rp=-1
IS=1,0,0
IS=2,0,0
IS=3,0,0
OS=1,16,0
PG 1
LB SU
  Rp=-1
LB G1
  H 20
  R1=IN
  R1=R1&7
  BR G1,R1=Rp
  Rp=R1
  CL K0,R1=0
  CL K1,R1=1
  CL K2,R1=2
  CL K3,R1>=3
  BR G1
E
LB K0
  SL 0
  H
  RT
LB K1
  VM=100000
  BR K9
LB K2
  VM=200000
  BR K9
LB K3
  VM=400000
LB K9
  MR R1*25600
  H
  O1=1
  H 100
  O1=0
  RT
PG
