//! A font of 5 x 7 dots and a row below for tails, with the letters that titles and units of quantities are made of.

/// Letters and their columns from the left, the top dot lowest; empty columns at the end are no part of a letter.
const LETTERS: &str = "\
0 3e5149453e 1 00427f40 2 4261514946 3 2141454b31 4 1814127f10 5 2745454539 6 3c4a494930 7 0171090503 8 3649494936 9 064949291e
A 7e1111117e B 7f49494936 C 3e41414122 D 7f4141221c E 7f49494941 F 7f09090901 G 3e4149497a H 7f0808087f I 417f41 J 2040413f01
K 7f08142241 L 7f40404040 M 7f020c027f N 7f0408107f O 3e4141413e P 7f09090906 Q 3e4151215e R 7f09192946 S 4649494931 T 01017f0101
U 3f4040403f V 1f2040201f W 3f4038403f X 6314081463 Y 0708700807 Z 6151494543
a 2054545478 b 7f48444438 c 3844444420 d 384444487f e 3854545418 f 087e090102 g 98a4a4a47c h 7f08040478 i 447d40 j 2040443d
k 7f102844 l 417f40 m 7c04180478 n 7c08040478 o 3844444438 p fc24242418 q 18242424fc r 7c08040408 s 4854545420 t 043f444020
u 3c4040207c v 1c2040201c w 3c4030403c x 4428102844 y 1ca0a0a07c z 4464544c44
− 0808080808 + 08083e0808 . 6060 , 5030 ( 1c2241 ) 41221c / 2010080402 % 2313086462 : 3636
° 06090906 µ fc4040207c ₂ 645448 ² 191512 ³ 15150a ¹ 121f10 ⁻ 040404";

/// Columns of a space.
const SPACE: [u8; 3] = [0; 3];
/// What stands for a letter that is not there.
const UNKNOWN: [u8; 5] = [0x7f, 0x41, 0x41, 0x41, 0x7f];

/// The columns of a letter.
pub(super) fn columns(letter: char) -> Vec<u8> {
    // A hyphen and a minus sign are the same dots.
    let letter = if letter == '-' { '−' } else { letter };
    if letter == ' ' {
        return SPACE.to_vec();
    }
    known(letter).unwrap_or_else(|| UNKNOWN.to_vec())
}

fn known(letter: char) -> Option<Vec<u8>> {
    let mut words = LETTERS.split_whitespace();
    words.find(|word| word.chars().eq([letter]))?;
    let hex = words.next()?;
    let column = |at: usize| u8::from_str_radix(hex.get(at..at + 2)?, 16).ok();
    (0..hex.len()).step_by(2).map(column).collect()
}

/// Columns of a text, one between letters.
pub(super) fn width(text: &str) -> u32 {
    let letters = text.chars().map(|letter| columns(letter).len() as u32 + 1);
    letters.sum::<u32>().saturating_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::quantity::Quantity;

    #[test]
    fn every_letter_of_titles_units_and_numbers_is_there() {
        let titles =
            Quantity::ALL.map(|quantity| quantity.title().to_owned() + quantity.display().unit);
        let letters = titles.concat().replace('-', "−") + "0123456789−.e";
        for letter in letters.chars().filter(|letter| *letter != ' ') {
            let columns = known(letter).unwrap_or_else(|| panic!("no letter {letter:?}"));
            assert!((1..=5).contains(&columns.len()), "{letter:?}");
            assert!(columns.iter().any(|column| *column != 0), "{letter:?}");
        }
        assert_eq!(columns('∑'), UNKNOWN);
    }

    #[test]
    fn no_two_letters_look_alike() {
        let mut words: Vec<&str> = LETTERS.split_whitespace().skip(1).step_by(2).collect();
        words.sort_unstable();
        let count = words.len();
        words.dedup();
        assert_eq!(words.len(), count);
    }
}
