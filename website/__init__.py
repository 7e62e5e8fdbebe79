"""The web site: the documents, the reference, the gallery, a report and the playground as one
static folder.
"""
