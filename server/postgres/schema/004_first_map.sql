-- oldest_program: 3
--
-- Whether a running job has a whole map, which its deadline would take.

ALTER TABLE isomatch.live_jobs
  ADD COLUMN has_map boolean NOT NULL DEFAULT false;

-- Whoever runs a job next, and nobody, has none.
CREATE FUNCTION isomatch.forget_map()
RETURNS trigger
LANGUAGE plpgsql AS $$
BEGIN
  NEW.has_map := false;
  RETURN NEW;
END $$;
CREATE TRIGGER forget_map BEFORE UPDATE ON isomatch.live_jobs
  FOR EACH ROW WHEN (NEW.has_map AND NEW.claim <> OLD.claim)
  EXECUTE FUNCTION isomatch.forget_map();

-- As renew_leases of 001_jobs.sql, which older programs go on calling.
CREATE FUNCTION isomatch.renew_leases(
  p_ids text[], p_claims bigint[], p_stages int[],
  p_stage_fractions double precision[], p_total_fractions double precision[],
  p_has_maps boolean[], p_lease interval)
RETURNS SETOF text
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  own text[] := ARRAY(
    SELECT isomatch.renew_leases(p_ids, p_claims, p_stages, p_stage_fractions,
                                 p_total_fractions, p_lease));
BEGIN
  UPDATE isomatch.live_jobs l
    SET has_map = r.has_map, sequence = nextval('isomatch.job_sequence')
    FROM unnest(p_ids, p_has_maps) AS r (id, has_map)
    WHERE l.id = r.id AND l.id = ANY (own) AND l.has_map <> r.has_map;
  RETURN QUERY SELECT unnest(own);
END $$;
