"""The admin door: an operator's calls, on an address of their own, behind a token of their own."""
