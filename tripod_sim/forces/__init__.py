"""Terms of the potential: what adds energy and force."""
