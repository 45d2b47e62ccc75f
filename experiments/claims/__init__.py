"""What the paper's section 4 says, sentence by sentence, each judged from the table and from nothing else."""

from experiments.claims.findings import Claim, Finding, write_claims
from experiments.claims.judging import VERDICTS, Judgement
from experiments.claims.paper import CLAIMS, judge_claims

__all__ = ["CLAIMS", "VERDICTS", "Claim", "Finding", "Judgement", "judge_claims", "write_claims"]
