//! Names of oceans and seas, and where they are written: those that Natural Earth (public domain; marine areas at 1:10
//! million) ranks 0 to 3, in English.

/// An ocean or a sea.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sea {
    pub(super) name: &'static str,
    /// 0 for oceans, then the smaller the larger the number.
    pub(super) rank: u8,
    /// Longitude and latitude of where its name may stand, degrees: the middle of the widest part. Oceans have several.
    pub(super) places: &'static [[f64; 2]],
    /// How far it reaches to the east and west of there, together, km.
    pub(super) width_km: f64,
}

const fn sea(rank: u8, name: &'static str, width_km: f64, places: &'static [[f64; 2]]) -> Sea {
    Sea {
        name,
        rank,
        places,
        width_km,
    }
}

/// Those of a small rank first, the wider first among equals.
pub(super) const SEAS: &[Sea] = &[
    sea(
        0,
        "North Pacific Ocean",
        5000.0,
        &[
            [-150.0, 30.0],
            [172.0, 34.0],
            [-135.0, 16.0],
            [-172.0, 14.0],
            [160.0, 42.0],
        ],
    ),
    sea(
        0,
        "South Pacific Ocean",
        5000.0,
        &[
            [-125.0, -26.0],
            [-152.0, -38.0],
            [-92.0, -36.0],
            [-103.0, -12.0],
            [-168.0, -48.0],
        ],
    ),
    sea(
        0,
        "North Atlantic Ocean",
        5000.0,
        &[
            [-40.0, 32.0],
            [-30.0, 46.0],
            [-50.0, 22.0],
            [-33.0, 13.0],
            [-22.0, 36.0],
        ],
    ),
    sea(
        0,
        "South Atlantic Ocean",
        5000.0,
        &[[-12.0, -24.0], [-20.0, -40.0], [-18.0, -10.0], [2.0, -36.0]],
    ),
    sea(
        0,
        "Indian Ocean",
        5000.0,
        &[
            [78.0, -22.0],
            [90.0, -34.0],
            [70.0, -6.0],
            [60.0, -36.0],
            [100.0, -26.0],
        ],
    ),
    sea(
        0,
        "Southern Ocean",
        4000.0,
        &[
            [20.0, -60.0],
            [80.0, -59.0],
            [125.0, -60.0],
            [-120.0, -62.0],
            [-160.0, -62.0],
            [-15.0, -60.0],
        ],
    ),
    sea(
        0,
        "Arctic Ocean",
        2600.0,
        &[[0.0, 86.0], [160.0, 81.0], [-150.0, 79.0], [90.0, 85.0]],
    ),
    sea(1, "Philippine Sea", 2480.0, &[[134.2, 17.1]]),
    sea(1, "Coral Sea", 2310.0, &[[156.6, -14.4]]),
    sea(1, "Caribbean Sea", 2310.0, &[[-72.4, 15.0]]),
    sea(1, "Arabian Sea", 2170.0, &[[61.4, 12.5]]),
    sea(1, "Tasman Sea", 2060.0, &[[162.0, -38.0]]),
    sea(1, "Gulf of Mexico", 1450.0, &[[-89.9, 25.9]]),
    sea(1, "Weddell Sea", 1420.0, &[[-38.4, -72.7]]),
    sea(1, "Bay of Bengal", 1320.0, &[[86.4, 13.2]]),
    sea(1, "South China Sea", 1300.0, &[[114.3, 13.5]]),
    sea(1, "Mediterranean Sea", 1120.0, &[[17.4, 34.5]]),
    sea(1, "Sea of Okhotsk", 1090.0, &[[146.9, 55.6]]),
    sea(1, "Ross Sea", 1000.0, &[[-172.0, -74.5]]),
    sea(1, "Labrador Sea", 990.0, &[[-53.3, 58.7]]),
    sea(1, "Sea of Japan", 930.0, &[[134.0, 39.2]]),
    sea(1, "Hudson Bay", 900.0, &[[-86.3, 59.9]]),
    sea(1, "Black Sea", 870.0, &[[34.0, 43.0]]),
    sea(1, "Beaufort Sea", 820.0, &[[-138.6, 71.5]]),
    sea(1, "Gulf of Alaska", 720.0, &[[-145.8, 58.4]]),
    sea(1, "Baffin Bay", 640.0, &[[-66.1, 73.3]]),
    sea(1, "Persian Gulf", 440.0, &[[53.8, 26.0]]),
    sea(1, "Caspian Sea", 430.0, &[[50.6, 42.0]]),
    sea(1, "Red Sea", 370.0, &[[41.0, 16.3]]),
    sea(2, "Sargasso Sea", 2000.0, &[[-60.0, 26.4]]),
    sea(2, "Scotia Sea", 1200.0, &[[-45.0, -57.5]]),
    sea(2, "Norwegian Sea", 1100.0, &[[2.0, 66.5]]),
    sea(2, "Bering Sea", 1100.0, &[[-170.9, 57.1]]),
    sea(2, "Banda Sea", 1060.0, &[[128.0, -5.6]]),
    sea(2, "Arafura Sea", 1030.0, &[[136.0, -10.0]]),
    sea(2, "Barents Sea", 980.0, &[[37.9, 75.5]]),
    sea(2, "Gulf of Guinea", 960.0, &[[3.8, 3.2]]),
    sea(2, "Java Sea", 960.0, &[[110.3, -4.6]]),
    sea(2, "Mozambique Channel", 890.0, &[[39.6, -20.2]]),
    sea(2, "Laccadive Sea", 850.0, &[[76.0, 6.0]]),
    sea(2, "Celebes Sea", 840.0, &[[124.0, 4.6]]),
    sea(2, "Greenland Sea", 810.0, &[[-2.1, 76.9]]),
    sea(2, "East China Sea", 800.0, &[[125.2, 29.3]]),
    sea(2, "Kara Sea", 740.0, &[[72.0, 76.0]]),
    sea(2, "Bellingshausen Sea", 700.0, &[[-80.0, -69.5]]),
    sea(2, "Drake Passage", 700.0, &[[-65.0, -58.7]]),
    sea(2, "Timor Sea", 700.0, &[[127.2, -11.0]]),
    sea(2, "Andaman Sea", 680.0, &[[95.3, 10.2]]),
    sea(2, "Laptev Sea", 650.0, &[[124.4, 74.5]]),
    sea(2, "Chukchi Sea", 640.0, &[[-171.6, 69.9]]),
    sea(2, "North Sea", 610.0, &[[3.3, 56.0]]),
    sea(2, "Davis Strait", 600.0, &[[-58.0, 65.5]]),
    sea(2, "Amundsen Sea", 600.0, &[[-112.0, -72.0]]),
    sea(2, "Bay of Campeche", 590.0, &[[-93.5, 20.1]]),
    sea(2, "Yellow Sea", 570.0, &[[123.1, 35.0]]),
    sea(2, "Gulf of Thailand", 540.0, &[[102.4, 9.3]]),
    sea(2, "Sulu Sea", 530.0, &[[119.5, 7.7]]),
    sea(2, "Bay of Biscay", 530.0, &[[-6.6, 46.7]]),
    sea(2, "Baltic Sea", 400.0, &[[17.5, 55.4]]),
    sea(2, "Irish Sea", 200.0, &[[-4.6, 53.8]]),
    sea(3, "Great Australian Bight", 1160.0, &[[128.6, -35.3]]),
    sea(3, "Gulf of Aden", 580.0, &[[47.0, 12.0]]),
    sea(3, "Gulf of Oman", 570.0, &[[60.0, 24.4]]),
    sea(3, "Gulf of Carpentaria", 560.0, &[[138.9, -14.9]]),
    sea(3, "Tyrrhenian Sea", 540.0, &[[12.7, 39.1]]),
    sea(3, "Hudson Strait", 450.0, &[[-70.5, 62.3]]),
    sea(3, "English Channel", 330.0, &[[-2.0, 50.0]]),
    sea(3, "Adriatic Sea", 300.0, &[[16.3, 42.4]]),
    sea(3, "Gulf of California", 270.0, &[[-108.4, 24.0]]),
    sea(3, "Gulf of Bothnia", 230.0, &[[19.3, 61.4]]),
    sea(3, "James Bay", 200.0, &[[-80.6, 53.5]]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use contract::land::LAND;

    /// Is a place on land? By the edges that a meridian to the south of it crosses.
    fn is_land([lon, lat]: [f64; 2]) -> bool {
        let crossings = LAND.iter().map(|ring| {
            let ends = ring.iter().zip(ring.iter().cycle().skip(1));
            let crossed = ends.filter(|(a, b)| {
                let is_across = (a[0] > lon) != (b[0] > lon);
                is_across && a[1] + (b[1] - a[1]) * (lon - a[0]) / (b[0] - a[0]) < lat
            });
            crossed.count()
        });
        crossings.sum::<usize>() % 2 == 1
    }

    #[test]
    fn names_stand_at_sea() {
        assert!(is_land([10.0, 50.0]) && is_land([-60.0, -10.0]) && !is_land([-30.0, 0.0]));
        for sea in SEAS {
            for place in sea.places {
                // What is enclosed by land is land there.
                let is_sea = !is_land(*place) || sea.name == "Caspian Sea";
                assert!(is_sea, "{} {place:?}", sea.name);
            }
        }
    }

    #[test]
    fn names_are_in_order_and_stand_once() {
        assert!((60..80).contains(&SEAS.len()), "{}", SEAS.len());
        let order = |sea: &Sea| (sea.rank, -sea.width_km);
        assert!(SEAS[7..].is_sorted_by(|a, b| order(a) <= order(b)));
        assert!(
            SEAS[..7]
                .iter()
                .all(|ocean| ocean.rank == 0 && ocean.places.len() > 3)
        );
        let mut names: Vec<_> = SEAS.iter().map(|sea| sea.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), SEAS.len());
    }
}
