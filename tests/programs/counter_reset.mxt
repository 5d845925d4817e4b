' for LMDCM
va n1=0
va n2=1000
vm=768000
pg1
lb su
 n1=0
lb q
 ma n1*n2
 h
 ic n1
 brq,n1<20
 br b,n1=20
 pr"over"
 e
lb b
 pr"twenty at "p;
 pr ", error " er
 dc n1
 ma 0,0,0
 h
 e
pg
s
