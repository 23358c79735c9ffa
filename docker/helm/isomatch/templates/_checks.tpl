{{/* What values must have together, in plain words; their types are the schema's. */}}
{{- define "isomatch.checks" -}}
{{- $values := .Values -}}
{{- if not (or $values.database.host $values.database.urlSecret.name) -}}
{{- fail "the chart brings no PostgreSQL: expected database.host, or database.urlSecret.name" -}}
{{- end -}}
{{- if not (or $values.insecure (and $values.tls.secretName $values.apiKeys.secretName)) -}}
{{- fail "expected tls.secretName and apiKeys.secretName, or insecure: true if whoever reaches the Service may do anything" -}}
{{- end -}}
{{- if and (hasPrefix "verify-" $values.database.sslMode) (not $values.database.urlSecret.name) (not $values.database.ca.secretName) -}}
{{- fail "database.sslMode verifies a certificate: expected database.ca.secretName" -}}
{{- end -}}
{{- if and $values.blobs.readOnly (not $values.blobs.claimName) -}}
{{- fail "blobs.readOnly is about a folder: expected blobs.claimName" -}}
{{- end -}}
{{- if and $values.worker.keda.enabled (gt (int $values.worker.keda.minReplicas) (int $values.worker.keda.maxReplicas)) -}}
{{- fail "expected worker.keda.minReplicas of at most worker.keda.maxReplicas" -}}
{{- end -}}
{{- if and $values.gateway.autoscaling.enabled (gt (int $values.gateway.autoscaling.minReplicas) (int $values.gateway.autoscaling.maxReplicas)) -}}
{{- fail "expected gateway.autoscaling.minReplicas of at most gateway.autoscaling.maxReplicas" -}}
{{- end -}}
{{- end -}}
