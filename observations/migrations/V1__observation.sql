-- Observations by natural key. Texts are compared by their bytes, so that every server gives rows in one order.
CREATE TABLE observation (
    dataset text COLLATE "C" NOT NULL,
    platform text COLLATE "C" NOT NULL,
    kind text COLLATE "C" NOT NULL CHECK (kind IN ('buoy', 'ship', 'station', 'profile')),
    obs_time timestamptz NOT NULL,
    place geometry(Point, 4326) NOT NULL,
    depth_m double precision NOT NULL,
    property text COLLATE "C" NOT NULL,
    value double precision NOT NULL,
    unit text COLLATE "C" NOT NULL,
    quality smallint NOT NULL CHECK (quality BETWEEN 1 AND 4),
    -- The order of answers: a page is a range of this index.
    PRIMARY KEY (obs_time, dataset, platform, property, depth_m)
);

-- Series and tracks of one platform.
CREATE INDEX observation_platform ON observation (dataset, platform, obs_time);
-- Regions.
CREATE INDEX observation_place ON observation USING gist (place);
-- Long spans of time: pages of a table that grows with time, at a thousandth of the size of the key.
CREATE INDEX observation_time ON observation USING brin (obs_time);
