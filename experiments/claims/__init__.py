"""What the paper's section 4 says, sentence by sentence, each judged from the table and from nothing else."""

from experiments.claims.findings import Claim, Finding, write_claims
from experiments.claims.judging import Judgement
from experiments.claims.paper import CLAIMS, judge_claims

__all__ = ["CLAIMS", "Claim", "Finding", "Judgement", "judge_claims", "write_claims"]
