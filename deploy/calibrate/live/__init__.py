"""`tandem calibrate live`: guides a person at the suit until every node can be calibrated."""
