"""Readers of files and bytes against damaged input.

Every input is read, or refused by a documented error that names the file: no other exception, no crash, no hang, no
memory out of proportion. Inputs are valid ones with damaged bytes, and structured ones with hostile values; inputs with
a new kind of error are damaged further. They are drawn from `random.Random` rather than by hypothesis, which keeps no
such collection: one that fails is a folder on disk, which is read again as it is.

python -m tests.fuzz obj --minutes 60     run one target for a time
python -m tests.fuzz --minutes 2          run all targets, two minutes each
python -m tests.fuzz obj --replay FOLDER  read one input again
"""
