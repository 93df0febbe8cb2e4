"""Files of other programs: their recordings in, our joint angles out."""
