"""Animals after which a lesson names people who shall not type their names (DESIGN 19, privacy)."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from typing import Final

_ENGLISH: Final = (
    "Badger Bat Bear Beaver Bee Bison Blackbird Butterfly Camel Cat Chamois Cheetah Crab Crane Cricket Crow Cuckoo Deer"
    " Dolphin Donkey Dormouse Dove Dragonfly Duck Eagle Eel Elephant Elk Falcon Ferret Finch Firefly Flamingo Fox Frog"
    " Gazelle Gecko Giraffe Goat Goose Gull Hamster Hare Hawk Hedgehog Heron Hippo Hornet Horse Ibex Jackdaw Jay"
    " Kangaroo Kingfisher Kite Koala Ladybird Lark Lemur Leopard Lion Lizard Llama Lobster Lynx Magpie Marmot Marten"
    " Meerkat Mole Moose Moth Mouse Newt Nightingale Octopus Otter Owl Panda Panther Parrot Pelican Penguin Pheasant"
    " Pike Polecat Pony Puffin Quail Rabbit Raccoon Raven Reindeer Robin Salmon Seal Shark Sheep Shrew Snail Sparrow"
    " Squid Squirrel Stork Swallow Swan Swift Tiger Toad Trout Turtle Viper Vole Walrus Weasel Whale Wolf Woodpecker"
    " Wren Yak Zebra"
)
_GERMAN: Final = (
    "Dachs Fledermaus Bär Biber Biene Bison Amsel Falter Kamel Katze Gämse Gepard Krabbe Kranich Grille Krähe Kuckuck"
    " Hirsch Delfin Esel Siebenschläfer Taube Libelle Ente Adler Aal Elefant Elch Falke Frettchen Fink Glühwurm"
    " Flamingo Fuchs Frosch Gazelle Gecko Giraffe Ziege Gans Möwe Hamster Hase Habicht Igel Reiher Nilpferd Hornisse"
    " Pferd Steinbock Dohle Häher Känguru Eisvogel Milan Koala Marienkäfer Lerche Lemur Leopard Löwe Eidechse Lama"
    " Hummer Luchs Elster Murmeltier Marder Erdmännchen Maulwurf Rentier Motte Maus Molch Nachtigall Krake Otter Eule"
    " Panda Panther Papagei Pelikan Pinguin Fasan Hecht Iltis Pony Papageitaucher Wachtel Kaninchen Waschbär Rabe Ren"
    " Rotkehlchen Lachs Robbe Hai Schaf Spitzmaus Schnecke Spatz Kalmar Eichhörnchen Storch Schwalbe Schwan Segler"
    " Tiger Kröte Forelle Schildkröte Viper Wühlmaus Walross Wiesel Wal Wolf Specht Zaunkönig Yak Zebra"
)
LISTS: Final = {"en": tuple(_ENGLISH.split()), "de": tuple(_GERMAN.split())}
"""Names by language. The lists need not have the same animals in the same order: a number is a name in each of them."""
COUNT: Final = min(len(names) for names in LISTS.values())


def animal(number: int, language: str) -> str:
    """The name of a number: an animal, and beyond the list the same animals with numbers.

    >>> animal(0, "en"), animal(COUNT, "de")
    ('Badger', 'Dachs 2')
    """
    turn, place = divmod(number, COUNT)
    name = LISTS[language][place]
    return name if turn == 0 else f"{name} {turn + 1}"


def choose(person: str, taken: Collection[int]) -> int:
    """A number for a person that nobody has: one that follows from who it is, or the next that is free."""
    first = int.from_bytes(hashlib.sha256(person.encode()).digest()[:4], "big") % COUNT
    turn = 0
    while True:
        for step in range(COUNT):
            number = turn * COUNT + (first + step) % COUNT
            if number not in taken:
                return number
        turn += 1
