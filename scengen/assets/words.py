"""Words that displays show, by their number."""

TRAINING_WORDS = tuple("WORLD PLANT MUSIC FRUIT BREAD CHAIR HOUSE NIGHT QUICK JUMBO GHOST BLACK".split())
"""Words of five different letters."""
UNSEEN_WORDS = tuple("TABLE STONE CLOUD OCEAN TIGER LEMON SUGAR VIDEO PIANO ZEBRA WALTZ FLAME".split())
"""Other words of five different letters."""
DOUBLED_WORDS = tuple("APPLE HELLO SWEET GRASS HAPPY LEVEL KAYAK RADAR".split())
"""Words of five letters with one twice."""
LONG_WORDS = tuple("PICTURE KITCHEN DOLPHIN TROUBLE PROBLEM MONKEYS JOURNAL HUSBAND".split())
"""Words of seven different letters."""
WORDS = TRAINING_WORDS + UNSEEN_WORDS + DOUBLED_WORDS + LONG_WORDS
"""All words: five different letters (two lists), five with one twice, seven different ones."""
