"""A trial on two hosts that are really separate: `tandem trial serve` there, `tandem trial --remote` here."""
