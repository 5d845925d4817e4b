; compiled lines, as a unit holds them
SA0=PS0
SA1=CV5
SA2=VR1
SA3=AM
SA4=XX
