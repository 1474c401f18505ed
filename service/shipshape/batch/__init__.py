"""Recordings and files of clusters -> one Parquet table and a report, on all cores, stoppable at any moment.

inputs -> reading -> chunks -> engine (processes | ray_data | threads that ask a service): segmentation, answers
-> parts, one file each, the journal of the run -> merging -> contacts.parquet -> summary, comparison -> page

Nothing of the service imports this package.
"""
