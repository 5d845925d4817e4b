' for MDI
' Counts in binary on three outputs.
S1=16,1,0
S2=16,1,0
S3=16,1,0
S4=0,1,0
VA BM=0
VA DJ=200
PG 1
LB Aa
  BM=0
LB Ac
  OL BM
  H DJ
  IC BM
  BR Ac, BM<8
  OL 0
  BR Aa, I4=0
  PR "off ", IL
E
PG
S
