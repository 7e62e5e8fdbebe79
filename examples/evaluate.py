"""Compare players by many games, with intervals.

    python examples/evaluate.py

Matches with the same game and seed have the same starts. It prints win rates with 95 % intervals
(Wilson's), and how the games ended:

"""

import apollonius

PURSUERS = ("intercept", "shielded:intercept", "P_curriculum")


def main(games: int = 1_000, evader: str = "E_scratch", pursuers: tuple = PURSUERS) -> None:
    """Play a match for each pursuer, from the same starts."""
    for pursuer in pursuers:
        match = apollonius.Match.of_names("paper", pursuer, evader, games, seed=0)
        result = apollonius.play_match(match)
        low, high = result.pursuer_win_interval
        print(f"{pursuer} wins {result.pursuer_win_rate:.1%} [{low:.1%}, {high:.1%}]")
        for outcome, count in result.outcomes.items():
            if count:
                print(f"    {outcome.replace('_', ' ')}: {count}")


if __name__ == "__main__":
    main()
