"""Label maps whose names of labels come with the program: values of a study's key ``names`` that are no files."""

CLASS_MAPS = ("totalsegmentator", "totalsegmentator_mr")
