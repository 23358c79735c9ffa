-- oldest_program: 2
--
-- What uploads that broke off have brought, so that they go on at any gateway.
--
--   partial_uploads  one row an upload: the first bytes of a mesh.
--   partial_chunks   those bytes.

CREATE TABLE isomatch.partial_uploads (
  tenant text NOT NULL,
  sha256 text NOT NULL,
  bytes bigint NOT NULL CHECK (bytes > 0),
  kept_at timestamptz NOT NULL DEFAULT clock_timestamp(),
  PRIMARY KEY (tenant, sha256)
);

CREATE TABLE isomatch.partial_chunks (
  tenant text NOT NULL,
  sha256 text NOT NULL,
  index int NOT NULL,
  -- 256 KiB each, but for the last one.
  content bytea NOT NULL,
  PRIMARY KEY (tenant, sha256, index),
  FOREIGN KEY (tenant, sha256) REFERENCES isomatch.partial_uploads
    ON DELETE CASCADE
);
ALTER TABLE isomatch.partial_chunks ALTER COLUMN content SET STORAGE EXTERNAL;

-- Begins to keep an upload. Returns how many of its first bytes stay as they are
-- kept already, in whole rows of p_row_bytes: the transaction has to insert the
-- rest, and to end with trim_uploads. NULL when as much is kept.
CREATE FUNCTION isomatch.keep_upload(
  p_tenant text, p_sha256 text, p_bytes bigint, p_row_bytes bigint,
  p_kept_for interval)
RETURNS bigint
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  kept bigint;
BEGIN
  DELETE FROM isomatch.partial_uploads
    WHERE tenant = p_tenant AND sha256 = p_sha256
      AND kept_at <= now() - p_kept_for;
  LOOP
    INSERT INTO isomatch.partial_uploads (tenant, sha256, bytes)
      VALUES (p_tenant, p_sha256, p_bytes)
      ON CONFLICT DO NOTHING;
    IF FOUND THEN
      RETURN 0;
    END IF;
    SELECT bytes INTO kept FROM isomatch.partial_uploads
      WHERE tenant = p_tenant AND sha256 = p_sha256 FOR UPDATE;
    EXIT WHEN FOUND;  -- or else it was removed meanwhile
  END LOOP;
  IF kept >= p_bytes THEN
    RETURN NULL;
  END IF;
  UPDATE isomatch.partial_uploads
    SET bytes = p_bytes, kept_at = clock_timestamp()
    WHERE tenant = p_tenant AND sha256 = p_sha256;
  DELETE FROM isomatch.partial_chunks
    WHERE tenant = p_tenant AND sha256 = p_sha256
      AND index = kept / p_row_bytes;  -- not whole, if it is there
  RETURN kept / p_row_bytes * p_row_bytes;
END $$;

-- Removes the oldest of the tenant while it has more than p_share bytes, and
-- while all have more than p_total bytes or p_most uploads the oldest of the
-- tenant that has most.
CREATE FUNCTION isomatch.trim_uploads(
  p_tenant text, p_share bigint, p_total bigint, p_most int)
RETURNS void
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  own bigint;
  total bigint;
  number bigint;
  too_much text;
BEGIN
  PERFORM pg_advisory_xact_lock(x'150A7C7'::int);
  LOOP
    SELECT coalesce(sum(bytes) FILTER (WHERE tenant = p_tenant), 0),
           coalesce(sum(bytes), 0), count(*)
      INTO own, total, number FROM isomatch.partial_uploads;
    too_much := NULL;
    IF own > p_share THEN
      too_much := p_tenant;
    ELSIF total > p_total THEN
      SELECT tenant INTO too_much FROM isomatch.partial_uploads
        GROUP BY tenant ORDER BY sum(bytes) DESC, tenant LIMIT 1;
    ELSIF number > p_most THEN
      SELECT tenant INTO too_much FROM isomatch.partial_uploads
        GROUP BY tenant ORDER BY count(*) DESC, tenant LIMIT 1;
    END IF;
    EXIT WHEN too_much IS NULL;
    -- None that is being replaced: whoever does that waits for this one's lock,
    -- and trims as well.
    DELETE FROM isomatch.partial_uploads
      WHERE (tenant, sha256) = (
        SELECT tenant, sha256 FROM isomatch.partial_uploads
          WHERE tenant = too_much ORDER BY kept_at, sha256 LIMIT 1
          FOR UPDATE SKIP LOCKED);
    EXIT WHEN NOT FOUND;
  END LOOP;
END $$;
