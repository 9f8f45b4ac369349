"""What the program does, in roles: acquiring, analysing, serving; `padwatch run` is all of them."""
