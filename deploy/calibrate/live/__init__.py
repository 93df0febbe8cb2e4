"""`tandem calibrate live`: a person at the suit is told what to do until every node can be calibrated."""
