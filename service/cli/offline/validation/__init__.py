"""Published figures beside padwatch's: the tables of Brito et al., rebuilt."""
